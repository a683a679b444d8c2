"""The accuracy statement as a command."""
