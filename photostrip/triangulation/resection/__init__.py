"""Space resection of photos on known points, from start values or in closed form."""
