"""The processes of a run: how they agree, and how networks are replicated or sharded."""
