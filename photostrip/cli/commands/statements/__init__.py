"""What is signed, as commands: the accuracy statement, the verification of a certificate."""
