"""Another arm: where it would stand to bend a light strip, and the moment it makes there.

Run: python docs/examples/own_arm.py
"""

import sys
from collections.abc import Sequence

from dualbend import arm_pair, load_scenario, make_run

ARM = "ur5"


def main(settings: Sequence[str] = ()) -> dict[str, float]:
    """Place two arms, bend a light strip; print and return distance and peak moment."""
    scenario = load_scenario("tuned", ["compliance=none", f"robot.model={ARM}", *settings])
    arm = arm_pair(scenario).left
    place = arm.placement
    print(f"{arm.model.name}: {arm.model.count} joints, payload {arm.model.payload_kg:g} kg")
    print(
        f"base {place.base_distance_m:.3f} m behind the mid-plane, {place.base_lateral_m:+.3f} m "
        f"beside, {place.base_height_m:.3f} m up, turned by {place.base_yaw_rad:.3f} rad"
    )
    result = make_run(scenario).run()
    peak = result.metrics["peak_moment"].value
    print(f"{result.outcome}: peak moment {1e3 * peak:.1f} mN m")
    return {"distance_m": place.base_distance_m, "peak_moment_nm": peak}


if __name__ == "__main__":
    main(sys.argv[1:])
