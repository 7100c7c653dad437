"""Every key in one table: what the window binds, what the tooltips name and what F1 shows."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Key:
    """One key: the window's method it calls, and what it does in a person's words."""

    sequence: str
    action: str
    words: str
    group: str


KEYS: tuple[Key, ...] = (
    Key("Space", "arm", "ARM: wait for the light switch and record", "Taking a shot"),
    Key("Esc", "abort", "Abort; closes a sheet first when one is open", "Taking a shot"),
    Key("T", "trigger_now", "Stand in for the light switch while armed", "Taking a shot"),
    Key("Ctrl+S", "save_elsewhere", "Save shots that are only in memory elsewhere", "Taking a shot"),
    Key("R", "toggle_rearm", "Re-arm by itself, on or off", "Taking a shot"),
    Key("H", "toggle_hold", "Hold the curves of LIVE still, or let them run on", "Taking a shot"),
    Key("S", "focus_source", "Choose the source", "Taking a shot"),
    Key("Ctrl+1", "show_live", "LIVE", "Pages"),
    Key("Ctrl+2", "show_shot_page", "SHOT", "Pages"),
    Key("Ctrl+3", "show_compare", "COMPARE", "Pages"),
    Key("Ctrl+4", "show_spectrum", "SPECTRUM", "Pages"),
    Key("Ctrl+5", "show_diagnosis", "DIAGNOSIS", "Pages"),
    Key("Ctrl+6", "show_budget", "BUDGET", "Pages"),
    Key("Ctrl+7", "show_paper", "PAPER", "Pages"),
    Key("F2", "toggle_settings", "Settings", "Pages"),
    Key("F3", "toggle_setup", "Set-up: devices, permission, signal check", "Pages"),
    Key("F4", "toggle_tour", "The short tour", "Pages"),
    Key("F1", "toggle_keys", "This sheet", "Pages"),
    Key("1", "view_whole", "Whole shot", "The shot's plots"),
    Key("2", "view_contact", "First contact (Fig. 5)", "The shot's plots"),
    Key("3", "view_deflection", "F against deflection (Fig. 6)", "The shot's plots"),
    Key("4", "view_gap", "Gap between the bodies (Fig. 7)", "The shot's plots"),
    Key("5", "view_raw", "Raw signals", "The shot's plots"),
    Key("0", "reset_view", "Reset the view", "The shot's plots"),
    Key("C", "toggle_cursors", "Two cursors", "The shot's plots"),
    Key("Ctrl+Shift+C", "copy_cursors", "Copy what lies between the cursors", "The shot's plots"),
    Key("Ctrl+P", "plot_menu", "Save the plot (PNG, SVG, CSV)", "The shot's plots"),
    Key("Ctrl+O", "open_recordings", "Open recordings", "The session"),
    Key("Ctrl+E", "export_selected", "Export CSV of the selected shots, or of all", "The session"),
    Key("Ctrl+T", "report_selected", "Report of the selected shots, or of all (HTML)", "The session"),
    Key("Ctrl+R", "reanalyse_selected", "Re-analyse as copies with the present settings", "The session"),
    Key("N", "edit_note", "Write a note on the shot", "The session"),
    Key("Del", "remove_selected", "Take the selected shots off the list", "The session"),
    Key("Ctrl+Z", "undo", "Take back the last note or removal", "The session"),
    Key("Ctrl+Up", "previous_shot", "Shot before", "The session"),
    Key("Ctrl+Down", "next_shot", "Shot after", "The session"),
    Key("D", "diagnose", "Diagnose the selected shots", "The session"),
    Key("Ctrl+Shift+O", "load_model", "Open a model file", "The session"),
    Key("Ctrl+Shift+S", "save_model", "Save the model of the selected shots, or of all", "The session"),
    Key("B", "show_budget", "Uncertainty budget of the shot", "The session"),
    Key("Ctrl+Q", "close", "Quit", "The session"),
)

ON_PLOT = (
    ("Left, Right", "move along the axis"),
    ("Up, Down", "closer, farther"),
    ("Home", "the whole again"),
    ("Shift+Left, Right", "move cursor A"),
    ("Ctrl+Left, Right", "move cursor B"),
)

MOUSE = (
    ("wheel", "zoom along the axis; over the left one, or with Ctrl, in value"),
    ("drag", "move along the axis"),
    ("click on a bounce", "zoom to it"),
    ("right click", "the plot's own menu"),
)
