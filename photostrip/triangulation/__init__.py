"""The method, one module for each photogrammetric operation."""
