"""The world: truth, devices, and the one loop that orders them."""
