"""What a fit saves between steps, and how a run is recognised as the same one."""
