"""RISK-SAC: joint search for safety-critical driving scenarios in SUMO.

Importing this package is cheap on purpose: the service reads its configuration models without
loading torch or libsumo. The method starts at :mod:`risk_sac.search.loop`.
"""

__version__ = "0.3.0"
