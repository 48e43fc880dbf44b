"""A workbench that plans how the parts of a document come apart."""
