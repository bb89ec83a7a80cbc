"""Losses, and steps that lower them."""
