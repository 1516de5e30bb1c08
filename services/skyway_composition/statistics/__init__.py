"""How pads and drones are used, from what missions have done."""
