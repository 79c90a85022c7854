"""The simulated world of Stroppa et al.: the human at the controls, and the arm with its gripper.

`people` says who somebody is; `belief`, `hand`, `decision` and `loop` what an operator believes, does and
decides in one period; `plant` how the arm follows its command and the gripper holds. What is tried in this
world belongs to `experiments`.

An operator sees a delayed picture and misjudges depth along the line of sight; corrects in single
submovements with a refractory pause; holds the device with a compliant hand; and presses the button when the
tip has looked right for a while. The attitude to a guidance force is an open factor: ignore it, use it as a
cue, or yield.

The rules are functions of plain numbers, compiled by the simulator. Lengths are metres at the tip unless
called hand; base frame of the robot, z down; one call per 10 ms.
"""
