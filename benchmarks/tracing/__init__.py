"""Our tracer against Mitsuba 3 on equal scenes and rays."""
