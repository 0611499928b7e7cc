"""The Python modules that the nodes in scripts/ share."""
