"""What a run writes for people: scene folders, cards, sheets, camera data sets."""
