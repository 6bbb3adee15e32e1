"""What settings are measured on: fixed inputs, and what a setting makes of them."""
