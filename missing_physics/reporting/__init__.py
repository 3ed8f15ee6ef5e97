"""What a person sees of a diagnosis: the HTML report, the rerun file and the printed summary."""

from missing_physics.reporting.html_report import write_html
from missing_physics.reporting.rerun_file import write_rerun
from missing_physics.reporting.summary import print_summary

__all__ = ["print_summary", "write_html", "write_rerun"]
