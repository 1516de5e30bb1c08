"""The parts of booking (`book`): a look at everything, what an offer takes, engaging its drones."""
