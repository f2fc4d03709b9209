"""Speed, specific force and grade from the sensors: of a whole drive, or second by second."""
