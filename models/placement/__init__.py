"""Where weights and tokens are while networks run: on which processes, in which memory."""
