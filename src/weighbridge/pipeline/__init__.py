"""The whole way: from a drive and a vehicle to a mass, and to a vehicle file."""
