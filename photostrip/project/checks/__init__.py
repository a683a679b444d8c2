"""What `photostrip check` looks at."""
