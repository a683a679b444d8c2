"""Reports of the commands beside ``run``: a module for each command, from its document to sections."""
