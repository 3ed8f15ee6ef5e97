"""Rotations and cross products, coordinates of joints and drives, and motions between samples."""
