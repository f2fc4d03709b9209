"""What comes out: masses, inertias and calibrations, and how they are written."""
