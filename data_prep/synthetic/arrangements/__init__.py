"""Static worlds without a level camera or a fixed up: for depth of single images."""
