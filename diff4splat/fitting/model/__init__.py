"""The fitted scene: raw parameters, initialisation, density control and static detection."""
