"""Vibration of links and of a base along a motion: response, integration, and its removal as noise."""
