"""The heaviest payload that anybody admitted could lift, whoever is free now."""

from skyway.contracts.candidate import PayloadLimit
from skyway.delivery.request import ProviderChoice
from skyway_provider_registry.candidates.fleet_columns import Fleet


def payload_limit(fleet: Fleet, choice: ProviderChoice) -> PayloadLimit:
    """The limit of the strongest model of all admitted providers' drones; equals by id."""
    named = (*filter(None, [choice.pinned]), *(choice.allowed or ()), *(choice.denied or ()))
    models = (
        model
        for provider_id, model in fleet.columns.strongest.items()
        if (provider := fleet.providers.get(provider_id)) is not None
        and provider.is_active
        and choice.admits(provider_id)
    )
    strongest = min(models, key=lambda one: (-one.max_payload_kg, one.model_id), default=None)
    return PayloadLimit(
        max_payload_kg=strongest.max_payload_kg if strongest else None,
        drone_model_id=strongest.model_id if strongest else None,
        unknown_provider_ids=tuple(
            provider_id
            for provider_id in dict.fromkeys(named)
            if provider_id not in fleet.providers
        ),
    )
