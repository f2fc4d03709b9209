"""The corpus: pairs of drive and vehicle of known mass, and what the program says of each.

``python -m studies.corpus`` weighs all pairs and prints each slice. ``--check`` compares with the
committed table `corpus.csv`, ``--accept`` rewrites it. README.md beside it has the rules.
"""

import sys
from pathlib import Path

# The other studies, which are scripts, import each other by name.
sys.path.insert(0, str(Path(__file__).parents[1]))
