"""What is signed: the accuracy statement, as a section of the report and as a page of its own."""
