"""Whether simulated graphs are like real ones: what is compared, and how far apart the two are."""
