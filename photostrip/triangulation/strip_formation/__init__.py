"""From oriented pairs to one strip: orientations handed on, model points, scale transfer."""
