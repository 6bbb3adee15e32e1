"""How objects move: rigid, jointed and soft, as positions of every vertex at every time."""
