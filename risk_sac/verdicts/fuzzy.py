"""The two fuzzy surfaces of the JRC's fuzzy safety model: how uncomfortable, and how critical, a gap is.

Sources: Mattas, Makridis, Botzoris, Kriston, Minarini, Papadopoulos, Re, Rognelund, Ciuffo 2020, "Fuzzy surrogate
safety metrics for real-time assessment of rear-end collision risk. A study based on empirical observations", Accident
Analysis & Prevention 148, 105794; UN Regulation 157 (01 series), Annex 3, performance model 2. Written from memory of
the formulas, not from the model's code. No public text with the equations was found, so the formulas below and their
parameters have still to be compared with the annex.
"""

from risk_sac.jit import compiled

REACTION_S = 0.75  # τ
COMFORT_MPS2 = 4.0  # b_comf
HARDEST_MPS2 = 6.0  # b_max
LEADER_MPS2 = 7.0  # the hardest braking expected of the vehicle ahead
REST_M = 2.0  # d1: wanted between the two when both stand


@compiled
def proactive(gap: float, ego: float, leader: float) -> float:
    """Computes PFS, the proactive fuzzy metric: 0 is safe, 1 is unsafe.

    0: the ego could stop in comfort behind a leader that brakes hard. 1: it could not even with its hardest braking.

    d_safe = u_e τ + u_e²/(2 b_comf) − u_l²/(2 b_lead),  d_unsafe = u_e τ + u_e²/(2 b_max) − u_l²/(2 b_lead)

    `gap` lies between the bodies, m; d1 of it is kept in reserve. In between PFS is linear.
    """
    leader_stops = leader * leader / (2 * LEADER_MPS2)
    safe = ego * REACTION_S + ego * ego / (2 * COMFORT_MPS2) - leader_stops
    unsafe = ego * REACTION_S + ego * ego / (2 * HARDEST_MPS2) - leader_stops
    return _between(gap - REST_M, safe, unsafe)


@compiled
def critical(gap: float, ego: float, ego_accel: float, leader: float) -> float:
    """Computes CFS, the critical fuzzy metric: 0 is safe, 1 is unsafe.

    0: comfortable braking after the reaction avoids a leader that keeps its speed. 1: no braking does.

    u_next = u_e + a' τ with a' = max(a_e, −b_comf);  d_new = ((u_e + u_next)/2 − u_l) τ

    d_safe = d_new + (u_next − u_l)²/(2 b_comf),  d_unsafe = d_new + (u_next − u_l)²/(2 b_max)

    Where the ego is the slower one within the reaction already, d_safe = d_unsafe = (u_e − u_l)²/(2 |a'|).
    In between CFS is linear.
    """
    if ego <= leader:
        return 0.0
    accel = max(ego_accel, -COMFORT_MPS2)
    later = ego + accel * REACTION_S
    if later <= leader:
        return 0.0 if gap > (ego - leader) ** 2 / (-2 * accel) else 1.0
    closed = ((ego + later) / 2 - leader) * REACTION_S
    squared = (later - leader) ** 2
    return _between(gap, closed + squared / (2 * COMFORT_MPS2), closed + squared / (2 * HARDEST_MPS2))


@compiled
def braking(gap: float, ego: float, ego_accel: float, leader: float) -> float:
    """Computes the model's braking, m/s².

    It rises to 4 with PFS, then to 6 with CFS. A leader that comes towards the ego has a negative speed,
    which only CFS can handle.
    """
    urgency = critical(gap, ego, ego_accel, leader)
    if urgency > 0.0:
        return COMFORT_MPS2 + urgency * (HARDEST_MPS2 - COMFORT_MPS2)
    return proactive(gap, ego, max(leader, 0.0)) * COMFORT_MPS2


@compiled
def _between(gap: float, safe: float, unsafe: float) -> float:
    if gap >= safe:
        return 0.0
    if gap <= unsafe:
        return 1.0
    return (safe - gap) / (safe - unsafe)
