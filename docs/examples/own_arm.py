"""An arm of your own, from its file: where it would stand, and the moment that it makes there.

Run: python docs/examples/own_arm.py
"""

from pathlib import Path

from dualbend import arm_pair, load_scenario, make_run

ARM = Path(__file__).with_name("own_arm.urdf")


def main() -> dict[str, float]:
    """Place two arms, bend a light strip; print and return distance and peak moment."""
    robot = {"model": str(ARM), "arm": {"payload_kg": 5.0}}
    scenario = load_scenario("tuned", {"robot": robot, "compliance": "none"})
    arm = arm_pair(scenario).left
    place = arm.placement
    print(f"{arm.model.name}: {arm.model.count} joints, reach {arm.model.reach_m:g} m")
    print(*(f"assumed: {text}" for text in arm.model.assumed), sep="\n")
    print(
        f"base {place.base_distance_m:.3f} m behind the mid-plane, {place.base_lateral_m:+.3f} m "
        f"beside, {place.base_height_m:.3f} m up, turned by {place.base_yaw_rad:.3f} rad"
    )
    result = make_run(scenario).run()
    peak = result.metrics["peak_moment"].value
    print(f"{result.outcome}: peak moment {1e3 * peak:.1f} mN m")
    return {"distance_m": place.base_distance_m, "peak_moment_nm": peak}


if __name__ == "__main__":
    main()
