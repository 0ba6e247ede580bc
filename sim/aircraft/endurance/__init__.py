"""A Goldberg-Endurance-class electric model aeroplane."""
