"""The cases of the comparison: what a build of gflow is asked to write into a folder."""
import shutil
import subprocess
import time
from pathlib import Path
from typing import Callable, NamedTuple

ROOT = Path(__file__).resolve().parents[2]
DEMO = ROOT / "apps/demo/scene"

# More settings of the demo scene: all flow transports (default: material) and both strategies of density control.
MODELS = {
    "spacetime": dict(density__opacity_reset_every=50),
    "native4d": dict(density__strategy="mcmc", flow__transport="paper", flow__calm=0.5),
    "keyframes": dict(flow__transport="ot", motion__key_scales="true", density__absgrad="true"),
    "bases": dict(flow__transport="translate", flow__top_k=8, flow__stop="exclude", train__batch=2),
    "hexplane": dict(hexplane__plane_tv=0.01, hexplane__l1_time=0.01, flow__reach=4, adam__beta1=0.9)}


def settings(steps, **more):
    """Options of a training of so many steps in which everything acts; SECTION__KEY names a setting."""
    values = dict(
        train__iterations=steps, train__log_every=10, train__checkpoint_every=steps // 2, train__focus=2,
        density__start=steps // 6, density__every=steps // 6, density__stop_fraction=0.8, density__cap=12000,
        motion__rest=0.5, motion__rest_every=steps * 7 // 30, motion__rest_wake=2, motion__sh_interval=steps // 4,
        loss__rigidity=0.1, loss__rotation=0.1, loss__isometry=0.1, loss__velocity=0.1, loss__acceleration=0.1,
        loss__motion_every=2, loss__neighbours_every=steps // 3, hexplane__warmup=steps // 6, render__near=0.05)
    return [f"--set={name.replace('__', '.')}={value}" for name, value in {**values, **more}.items()]


def gflow(program, *arguments):
    done = subprocess.run([program, *map(str, arguments)], stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
                          errors="replace")
    if done.returncode != 0:
        raise RuntimeError(f"{arguments[0]}: exit code {done.returncode}: {(done.stdout.splitlines() or [''])[-1]}")


class Case(NamedTuple):
    name: str
    make: Callable  # (program, folder, old): writes the folder; old(name) is the folder that OLD wrote for a case
    options: list  # part of the cache's key
    expected: str = ""  # the case whose OLD result is the reference; empty: this one


def splat_case(oracle):
    transport, *exclude = oracle.stem.split("_")[1:]
    options = ["--transport", transport, "--stop", "exclude" if exclude else "include"]

    def make(program, folder, old):
        folder.mkdir()
        for lanes in (0, 1):  # what suits the device, and one pixel per work-item, as on GPUs
            gflow(program, "splat", oracle, "-o", folder / f"lanes{lanes}.npz", "--lanes", lanes, *options)
    return Case(f"splat {oracle.stem}", make, options)


def train_case(name, scene, options, flow_of=""):
    """flow_of: a case of OLD whose optical flow is used again, because it takes longer than training."""
    def make(program, folder, old):
        if flow_of:
            shutil.copytree(old(flow_of) / "flow", folder / "flow")
            shutil.copy(old(flow_of) / "caches.stamp", folder)
        gflow(program, "train", scene, "-o", folder, "--quiet", "--resume", *options)
    return Case(name, make, options)


def resume_case(model, options, steps):
    """NEW is stopped after half of the steps and resumed."""
    def make(program, folder, old):
        command = ["train", DEMO, "-o", folder, "--quiet", *options]
        training = subprocess.Popen([program, *map(str, command)], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        try:
            while training.poll() is None and not (folder / f"checkpoints/iteration_{steps // 2}.npz").exists():
                time.sleep(0.002)
        finally:
            training.terminate()
        if training.wait() != 143:
            raise RuntimeError("training ended before it was stopped")
        gflow(program, *command, "--resume")
    return Case(f"resume {model}", make, options, f"train {model}")


def continue_case(model, options, steps):
    """NEW continues a training from the checkpoint that OLD wrote after half of the steps."""
    def make(program, folder, old):
        later = ("point_cloud", f"iteration_{steps}.npz", "test", "compare.png", "results.json", "per_view.json")
        shutil.copytree(old(f"train {model}"), folder, ignore=shutil.ignore_patterns(*later))
        gflow(program, "train", DEMO, "-o", folder, "--quiet", "--resume", *options)
    return Case(f"continue {model}", make, options, f"train {model}")


def show_case(model, options):
    """Renders, exports and evaluates a run of OLD."""
    def make(program, folder, old):
        run = folder.with_name(folder.name + " run")
        shutil.copytree(old(f"train {model}"), run)
        gflow(program, "render", run, "-o", folder, "--scene", DEMO, "--times", "0,0.3,1", "--quiet")
        gflow(program, "export", run, "-o", folder / "still.ply", "--times", "0.3")
        gflow(program, "export", run, "-o", folder / "moving.4dgs")
        if model in ("spacetime", "native4d"):
            gflow(program, "export", run, "-o", folder / "moving.splatv")
        gflow(program, "eval", run, "--split", "train", "--quiet")
        for results in run.glob("*_train.json"):
            results.rename(folder / results.name)
        shutil.rmtree(run)
    return Case(f"show {model}", make, options)


def start_case(model):
    """Trains from a model that OLD exported."""
    options = settings(12, scene__resolution=4)

    def make(program, folder, old):
        gflow(program, "train", DEMO, "-o", folder, "--quiet", "--init", old(f"show {model}") / "still.ply", *options)
    return Case(f"start from {model}", make, options)


def all_cases(scene, quick):
    oracles = [*([] if quick else ROOT.glob("../shared/oracle/*.npz")), *ROOT.glob("tests/data/oracle/*.npz")]
    yield from map(splat_case, {path.name: path for path in sorted(oracles)}.values())
    steps = 120
    for model, more in MODELS.items():
        options = settings(steps, motion__model=model, scene__resolution=2, scene__max_steps=10, init__dynamic=2000,
                           **more)
        yield train_case(f"train {model}", DEMO, options)
        if not quick or model == "spacetime":
            yield resume_case(model, options, steps)
            yield continue_case(model, options, steps)
            yield show_case(model, options)
    yield start_case("spacetime")
    first = ""
    for model in MODELS if scene else ():
        options = settings(500, motion__model=model, density__cap=20000)
        yield train_case(f"train {scene.name} {model}", scene, options, first)
        first = first or f"train {scene.name} {model}"
