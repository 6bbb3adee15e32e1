"""Drawing procedural worlds: pictures with exact depth, masks, flow and tracks, on one core."""
