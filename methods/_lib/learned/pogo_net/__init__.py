"""The reconstruction of PoGO-Net: messages and gates on the residuals of a view graph."""
