"""Scenes as OpenUSD stages with time samples."""
