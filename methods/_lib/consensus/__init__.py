"""Parts of the consensus method: evidence of triangles, growth by votes, scales of cameras, comparison of solutions."""
