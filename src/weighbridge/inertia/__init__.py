"""Sprung mass, roll inertia and pitch inertia from the ride: filter, suspension, what is needed."""
