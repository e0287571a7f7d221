"""`python -m risk_sac` is `risk-sac`."""

import sys

from risk_sac.cli import main

sys.exit(main())
