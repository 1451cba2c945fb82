"""Plan, check and simulate formations of modular robots.

::

    import formation

    scenario = formation.Scenario.from_map(target="o-o-o", modules="A-A   s")
    plan = formation.plan(scenario)
    plan.assignments        # {1: 1, 2: 2, 3: 3}, module: spot
    plan.film()             # plays in a notebook

The core is that of the programs, so all numbers equal those of the command line, bit for bit. ``formation.ros`` announces and
follows real formations, and needs rclpy.
"""

from .errors import FormationError, MotionError, OptionError, PlanError, ScenarioError, TraceError
from .figures import Film, Picture
from .plans import Plan, Policy, check, explain, instance, plan
from .scenarios import Scenario
from .simulations import Event, Simulation, fault_kinds, simulate
from .traces import Verdict, verify

__all__ = [
    "Event",
    "Film",
    "FormationError",
    "MotionError",
    "OptionError",
    "Picture",
    "Plan",
    "PlanError",
    "Policy",
    "Scenario",
    "ScenarioError",
    "Simulation",
    "TraceError",
    "Verdict",
    "check",
    "explain",
    "fault_kinds",
    "instance",
    "plan",
    "simulate",
    "verify",
]
