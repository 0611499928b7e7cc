"""The pictures, as SVG: the same bytes for the same samples."""
import matplotlib
from matplotlib import pyplot

from samples import CANCEL, NEWER

matplotlib.use("svg")
matplotlib.rcParams.update({
    "svg.hashsalt": "actions_tutorial", "svg.fonttype": "none", "font.sans-serif": "DejaVu Sans",
    "axes.spines.top": False, "axes.spines.right": False})
STATES = {"waits (PENDING)": "lightgray", "washes (ACTIVE)": "tab:blue", "should stop, washes on": "tab:orange"}


def save(path):
    pyplot.savefig(path, format="svg", bbox_inches="tight",
                   metadata=dict.fromkeys(["Creator", "Date", "Format", "Type"]))
    pyplot.close()


def plot(benchmark, path):
    """Draw cancel → result as cumulative distributions."""
    _, axes = pyplot.subplots(figsize=(8, 4))
    for figure, kind, colour, label in (
            ("answer", "floor", "tab:gray", "floor: a message and its answer"),
            ("cancel", "robust", "tab:blue", "robust_action_server.py"),
            ("cancel", "hz20", "tab:green", "action_server.py at 20 Hz"),
            ("cancel", "plain", "tab:orange", "action_server.py")):
        times = sorted(1e3 * value for value in benchmark.samples[figure, kind])
        axes.plot(times, [100 * i / (len(times) - 1) for i in range(len(times))], color=colour, linewidth=2,
                  label="%s\nmedian %.3g ms" % (label, 1e3 * benchmark.median(figure, kind)))
    axes.set_xscale("log")
    axes.minorticks_off()
    axes.xaxis.set_major_formatter(pyplot.FuncFormatter(lambda value, _: "%g" % value))
    axes.set(xlabel="time since the cancel was sent (ms, logarithmic)", ylabel="cancels with a result by then (%)",
             ylim=(0, 100), title="Cancel → result")
    axes.grid(True, alpha=0.25)
    axes.legend(loc="center left", bbox_to_anchor=(1.01, 0.5), frameon=False, labelspacing=1.5)
    save(path)


def timeline(servers, path):
    """Draw a newer goal and a cancel. servers: of Benchmark.timeline."""
    figure, (plain, robust) = pyplot.subplots(2, figsize=(9, 4.6), sharex=True)
    for axes, kind, title in (plain, "plain", "action_server.py"), (robust, "robust", "robust_action_server.py"):
        axes.set_title(title, loc="left", fontsize=10, weight="bold", pad=30 if axes is plain else 4)
        axes.set(yticks=(1, 0), yticklabels=("first goal", "newer goal"), ylim=(-0.5, 1.6))
        for y, goal in zip((1, 0), servers[kind]):
            draw_goal(axes, y, goal)
    for second, what in (NEWER, "a newer goal is sent"), (CANCEL, "it is cancelled"):
        for axes in plain, robust:
            axes.axvline(second, color="black", linestyle=":", linewidth=1)
        plain.annotate(what, (second, 1), (0, 16), xycoords=("data", "axes fraction"), textcoords="offset points",
                       ha="center")
    robust.set(xlabel="seconds since the first goal was sent", xlim=(-0.1, 7))
    handles = [pyplot.Rectangle((0, 0), 1, 1, color=colour, label=state) for state, colour in STATES.items()]
    figure.legend(handles=handles, loc="lower center", ncol=3, frameon=False, bbox_to_anchor=(0.5, -0.07))
    figure.tight_layout()
    save(path)


def draw_goal(axes, y, goal):
    def write(text, second, shift, side):
        axes.annotate(text, (second, y), (shift, 0), textcoords="offset points", ha=side, va="center", weight="bold",
                      bbox={"color": "white", "pad": 1})

    moments = [goal[event] for event in ("sent", "active", "stop", "result")]
    for colour, begin, end in zip(STATES.values(), moments, moments[1:]):
        axes.barh(y, end - begin, left=begin, height=0.34, color=colour)
    for name, second in goal.items():
        if name.startswith("bowl"):
            axes.plot(second, y, "o", color="white", markeredgecolor="black", markersize=6)
            axes.annotate(name, (second, y), (0, 12), textcoords="offset points", fontsize=8)
    write("PREEMPTED after %s" % milliseconds(goal["result"] - goal["stop"]), goal["result"], 5, "left")
    if y == 0:
        write("ACTIVE after %s" % milliseconds(goal["active"] - goal["sent"]), goal["sent"], -6, "right")


def milliseconds(seconds):
    return "%.*f ms" % (seconds < 0.01, 1e3 * seconds)
