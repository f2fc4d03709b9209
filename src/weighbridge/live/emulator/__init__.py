"""Devices that are not there: a recorded drive comes out of an adapter, a receiver and a sensor."""
