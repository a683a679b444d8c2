"""What is too long for the file of its command, a module for each job."""
