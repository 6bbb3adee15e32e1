"""How Gaussians move: every motion answers ``state_at(gaussians, time_s)``."""
