"""Pages of results that are kept: runs and committed tables in, a folder of static pages out."""
