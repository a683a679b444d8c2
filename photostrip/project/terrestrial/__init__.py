"""Files of `photostrip terrestrial`."""
