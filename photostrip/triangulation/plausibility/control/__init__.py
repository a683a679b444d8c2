"""Mistakes in the control: readings, heights, lists, single points, place and layout."""
