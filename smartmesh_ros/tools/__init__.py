"""Tools around the product: the view, the tuner, the demo, and what tests and other simulators use."""
