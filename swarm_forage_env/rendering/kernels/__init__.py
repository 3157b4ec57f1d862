"""Compiled functions of painting."""
