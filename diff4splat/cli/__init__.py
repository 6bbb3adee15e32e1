"""The command line; imports torch only inside commands."""
