import sys, time, tempfile, traceback
from pathlib import Path
sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
import numpy as np
from commissioning_world import *
from tactile_node.commissioning.procedure import CommissioningProcedure
from tactile_node.commissioning.commissioning_record import CommissioningRecord
from tactile_node.commissioning.plan import CommissioningPlan, GaugeBlock
for seed in range(int(sys.argv[1]), int(sys.argv[2])):
    rng=np.random.default_rng(seed)
    truth=random_truth(rng); desk=CommissioningDesk(truth,rng)
    plan=CommissioningPlan(GRID,'joint',truth.unit,truth.low,truth.high,truth.most_effort,tuple(GaugeBlock(w,l) for w,l in FACES.items()),5.0)
    path=tempfile.mktemp()
    p=CommissioningProcedure(desk,desk,plan,CommissioningRecord(path))
    t=time.time(); v=desk.now()
    try: p.run(); end='ok'
    except Exception as e: end=repr(e); (traceback.print_exc() if 'AssertionError' not in end and 'Refused' not in end else None)
    print(seed, truth.unit, end, f'{time.time()-t:.1f} s real, {desk.now()-v:.0f} s virtual', [str(r[1]) for r in p.refused][:6], flush=True)
