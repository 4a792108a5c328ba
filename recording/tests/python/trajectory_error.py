"""ATE and RPE of two TUM files by evo, as JSON.

    trajectory_error.py TRUTH ESTIMATE
"""

import json
import sys

from evo.core import metrics, sync
from evo.core.metrics import PoseRelation, Unit
from evo.tools import file_interface

truth, estimate = (file_interface.read_tum_trajectory_file(path) for path in sys.argv[1:3])
truth, estimate = sync.associate_trajectories(truth, estimate, max_diff=1e-6)
answer = {"count": truth.num_poses}


def statistics(metric, pair):
    metric.process_data(pair)
    return metric.get_all_statistics()


answer["ate"] = statistics(metrics.APE(PoseRelation.translation_part), (truth, estimate))
for delta in (1, 10):
    for all_pairs in (False, True):
        for relation in (PoseRelation.translation_part, PoseRelation.rotation_angle_rad):
            metric = metrics.RPE(relation, delta=delta, delta_unit=Unit.frames, all_pairs=all_pairs)
            key = f"{relation.name} {delta} {'all' if all_pairs else 'steps'}"
            answer[key] = statistics(metric, (truth, estimate))
estimate.align(truth)
answer["ate aligned"] = statistics(metrics.APE(PoseRelation.translation_part), (truth, estimate))
print(json.dumps(answer))
