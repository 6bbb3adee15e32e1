"""Output files of Video Depth Anything and MegaSaM, as those tools write them."""
