"""Reports of plans: a module for each kind; ``report`` finds the one for a document."""
