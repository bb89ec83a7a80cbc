"""Tables of scored rows, in the console, Markdown, CSV and LaTeX."""
