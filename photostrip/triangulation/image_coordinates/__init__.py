"""From comparator or pixel coordinates to ideal image coordinates around the principal point."""
