"""The variables and parameters of each stage kind of the kino-dynamic problem, declared once, in the order of memory."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

from aerial_model.robot.robot import Robot
from aerial_planner.formulation.vector_layout import StageLayout, VectorLayout

_MOTION_OF_BODY = {"r": (3,), "rdot": (3,), "alpha": (3,), "quaternion": (4,)}


@dataclass(frozen=True, kw_only=True)
class KinoDynamicLayouts:
    """The layouts of one robot's stage kinds; symbols as in docs/notation.md, SI units, positions in S, ω in B."""

    n: int  # joints that plans move
    n_whole: int  # joints of the whole robot, those included that plans leave at home
    n_c: int  # contact points
    n_a: int  # arms, joints that carry no contact point
    n_limited: int  # joints whose torque is limited in flight
    timed: bool  # phase durations are optimized

    @staticmethod
    def of(robot: Robot, *, n_limited: int, timed: bool) -> KinoDynamicLayouts:
        """Return the layouts of a robot, of which ``robot.planned`` moves."""
        planned = robot.planned
        return KinoDynamicLayouts(
            n=planned.n_joints,
            n_whole=robot.n_joints,
            n_c=robot.n_contacts,
            n_a=len(planned.arms),
            n_limited=n_limited,
            timed=timed,
        )

    @cached_property
    def motion(self) -> VectorLayout:
        """The part of a take-off state that the start of a motion fixes."""
        return VectorLayout("motion of a take-off knot", **_MOTION_OF_BODY, q_j=(self.n,), dq_before=(self.n,))

    @cached_property
    def take_off_state(self) -> VectorLayout:
        """State of take-off knots and the lift-off knot."""
        return VectorLayout(
            "state of a take-off knot",
            **self.motion.entries,  # dq_before: joint rates on the interval before
            stretch=(int(self.timed),),  # factor by which the phase's time steps are longer than the schedule's
        )

    @cached_property
    def take_off_parameters(self) -> VectorLayout:
        """Parameters of a take-off knot."""
        n, n_whole = self.n, self.n_whole
        return VectorLayout(
            "parameters of a take-off knot",
            dt=(),
            r_ref=(3,),
            rdot_ref=(3,),
            quaternion_ref=(4,),
            q_j_ref=(n,),
            q_j_frozen=(n,),  # joint positions that AAKD* takes for the frozen joints
            foot_ref=(3, self.n_c),  # footholds; in z, how high points in the air must be at least
            x_0=(self.motion.size,),  # the motion at the first knot
            margin=(n_whole,),  # share of torque and voltage limits that may be used
            H_joint=(n_whole, n),  # see ``LegInertia``
            H_wrench=(n_whole, 6),
        )

    def take_off(self, *, n_loaded: int, n_ending: int = 0, ends_phase: bool = False) -> StageLayout:
        """Return the layout of a take-off knot with ``n_loaded`` contacts.

        Args:
            n_loaded: number of contact points that bear load.
            n_ending: at the last knot, number of joints that hold a contact point; else 0.
            ends_phase: the next knot is of another phase.
        """
        return StageLayout(
            state=self.take_off_state,
            control=VectorLayout(
                "control of a take-off knot",
                omega=(3,),
                dq_j=(self.n,),
                f=(3, n_loaded),
                dq_end=(n_ending,),  # joint rates at which the last contacts end
                next_stretch=(int(self.timed and ends_phase),),
            ),
            parameters=self.take_off_parameters,
        )

    @cached_property
    def lift_off(self) -> StageLayout:
        """The knot at which the last contacts end and the flight begins."""
        return StageLayout(
            state=self.take_off_state,
            control=VectorLayout(
                "control of the lift-off knot",
                omega=(3,),  # on the first interval in flight
                omega_ground=(3,),  # at which the contacts end
                arm_rate=(self.n_a,),  # arms' q̇_j on the first interval in flight
                T=(),  # flight time
            ),
            parameters=VectorLayout(
                "parameters of the lift-off knot",
                dt=(),
                foot_ref=(3, self.n_c),
                T_ref=(),
                landing_com=(3,),
                **self._path,
                margin=(self.n_whole,),  # share of the torque limits with which the legs' flight may begin
                H_flight=(self.n_whole, self.n),  # H_jj − H_jb H_bb⁻¹ H_bj at lift-off
                onset=(2,),  # see ``FlightPath.onset``
            ),
        )

    @cached_property
    def flight(self) -> StageLayout:
        """The knots in the air."""
        return StageLayout(
            state=self._flight_state,
            control=VectorLayout("control of a flight knot", omega=(3,), arm_rate=(self.n_a,)),
            parameters=VectorLayout(
                "parameters of a flight knot",
                **self._path,
                quaternion_ref=(4,),
                H_arms=(self.n_limited, self.n_a),  # H_jj − H_jb H_bb⁻¹ H_bj of limited joints and arms
                tau_settling=(self.n_limited,),  # torque while the legs end the take-off's motion
                tau_folding=(self.n_limited,),  # T² × torque while the legs follow their path
                margin=(self.n_limited,),
            ),
        )

    @cached_property
    def touchdown(self) -> StageLayout:
        """The last knot."""
        return StageLayout(
            state=self._flight_state,
            control=VectorLayout("control at touchdown"),
            parameters=VectorLayout("parameters of touchdown", goal=(4,)),
        )

    @cached_property
    def _flight_state(self) -> VectorLayout:
        return VectorLayout(
            "state of a flight knot",
            alpha=(3,),
            quaternion=(4,),
            q_j=(self.n,),
            T=(),
            arm_rate_before=(self.n_a,),  # arms' q̇_j on the interval before
        )

    @property
    def _path(self) -> dict[str, tuple[int, ...]]:
        """An interval of ``FlightPath``: share of the flight time, fraction of the way to the pose ahead, that pose."""
        return {"share": (), "fraction": (), "pose_ahead": (self.n,)}
