"""Motions of the fabric with their gradient written out, for training.

A window of the fabric is hundreds of small operations, and calling them takes most of the time.
Here the networks share one batch of products, the second derivatives of Psi are written out, and
the gradient of each weight is one product over all steps. `methods.ngf.integrate` has the
equations. ``d_x`` is the gradient of the loss with respect to x. Axes: N networks, S seeds, W
steps, B samples, H joints.
"""

from collections.abc import Sequence
from typing import Any, NamedTuple

import torch
from torch import Tensor
from torch.autograd.function import once_differentiable

from methods.layers import Weights, softplus
from tasks.data import CONTROL_STEP
from tasks.product import plain_product

NETWORKS = ("geometry", "metric", "potential", "damping")
_LAYERS = ("_context", "0", "1", "2")
AT_REST = 1e-12
"""Added to |v|^2, by which p_e divides."""


def motion_with_gradient(
    weights: Weights, context: Tensor, q: Tensor, v: Tensor, steps: int
) -> Tensor:
    """Returns the joints after each step, (S, B, W, H), with a gradient for the weights alone.

    Args:
        weights: the weights of `methods.ngf.NGF`.
        context: c, (S, B, D).
        q: the joints before the first step, (S, B, H).
        v: their velocity, (S, B, H).
        steps: W.
    """
    arrays = [
        weights[f"{network}{layer}.{kind}"]
        for layer in _LAYERS
        for kind in ("weight", "bias")
        for network in NETWORKS
    ]
    motion: Tensor = _Motion.apply(steps, context, q, v, weights["stiffness"], *arrays)
    return motion


class _Step(NamedTuple):
    """The numbers of a step that the gradient needs, under their names in `_Motion.forward`."""

    q: Tensor
    v: Tensor
    slope1: Tensor
    slope2: Tensor
    bend: Tensor
    share: Tensor
    force: Tensor
    energy: Tensor
    along: Tensor
    damping: Tensor
    residual: Tensor
    back2: Tensor
    lever2: Tensor
    back1: Tensor
    lever1: Tensor
    pull: Tensor


class _Motion(torch.autograd.Function):
    @staticmethod
    def forward(
        ctx: Any,
        steps: int,
        context: Tensor,
        q: Tensor,
        v: Tensor,
        stiffness: Tensor,
        *arrays: Tensor,
    ) -> Tensor:
        seeds, batch, joints = q.shape
        packed = [_side_by_side(arrays[i : i + 4]) for i in range(0, len(arrays), 4)]
        weight_c, bias_c, weight0, bias0, weight1, bias1, weight2, bias2 = packed
        psi0, psi1, psi2 = _of_potential(weight0, weight1, weight2, seeds=seeds)
        psi0, psi2 = psi0[:, :, :joints], psi2[:, :joints]
        k, one = stiffness[:, None], q.new_ones(())
        minus, half = -one, one / 2
        # tanh(x) = 2 sigmoid(2 x) - 1, which torch computes several times as fast.
        context = context.repeat(len(NETWORKS), 1, 1)
        bias0 = 2 * (plain_product(context, weight_c.mT) + (bias_c + bias0)[:, None])
        into0, into1, bias1 = 2 * weight0.mT, 2 * weight1.mT, 2 * bias1[:, None]
        into2, bias2 = weight2.mT, bias2[:, None]
        inputs, first, second = (
            q.new_empty(len(context), steps, batch, into.shape[1]) for into in (into0, into1, into2)
        )
        kept, motion = [], []
        for x, h1, h2 in zip(inputs.unbind(1), first.unbind(1), second.unbind(1), strict=True):
            x.unflatten(0, (-1, seeds)).copy_(torch.cat([q, v], dim=-1))
            torch.add(minus, plain_product(x, into0).add_(bias0).sigmoid_(), alpha=2, out=h1)
            torch.add(minus, plain_product(h1, into1).add_(bias1).sigmoid_(), alpha=2, out=h2)
            out = plain_product(h2, into2).add_(bias2).unflatten(0, (-1, seeds))
            geometry, metric, potential, damping = out.unbind()
            slope1, slope2 = (torch.addcmul(one, h, h, value=-1) for h in (h1, h2))
            slope1_p, slope2_p = _of_potential(slope1, slope2, seeds=seeds)

            bend, weight = geometry.split(joints, dim=-1)
            weight = torch.sub(weight, metric[..., :joints]).mul_(0.5).tanh_()
            share = torch.add(half, weight, alpha=0.5)
            force = share * bend
            energy = (v * v).sum(dim=-1, keepdim=True)
            along = (force * v).sum(dim=-1, keepdim=True).div_(energy + AT_REST)

            residual = torch.addcmul(potential[..., :joints], k, q)
            back2 = plain_product(residual, psi2)
            lever2 = back2 * slope2_p
            back1 = plain_product(lever2, psi1)
            lever1 = back1 * slope1_p
            pull = plain_product(lever1, psi0).add_(k * residual)

            damping = softplus(damping[..., :1])
            change = torch.addcmul(force, along, v, value=-1).mul_(energy / joints)
            change.addcmul_(share - 1, pull).addcmul_(damping, v, value=-1)
            step = (slope1, slope2, bend, share, force, energy, along, damping)
            kept.append(_Step(q, v, *step, residual, back2, lever2, back1, lever1, pull))
            v = torch.add(v, change, alpha=CONTROL_STEP)
            q = torch.add(q, v, alpha=CONTROL_STEP)
            motion.append(q)
        ctx.kept = kept
        ctx.shapes = [array.shape for array in arrays]
        ctx.save_for_backward(context, stiffness, inputs, first, second, weight0, weight1, weight2)
        return torch.stack(motion, dim=2)

    @staticmethod
    @once_differentiable  # type: ignore[untyped-decorator]
    def backward(ctx: Any, d_motion: Tensor) -> tuple[Tensor | None, ...]:
        context, stiffness, inputs, first, second, weight0, weight1, weight2 = ctx.saved_tensors
        seeds, batch, steps, joints = d_motion.shape
        psi0, psi1, psi2 = _of_potential(weight0, weight1, weight2, seeds=seeds)
        psi0, psi2 = psi0[:, :, :joints], psi2[:, :joints]
        k = stiffness[:, None]

        # What does not depend on later steps, for all of them.
        kept: list[_Step] = ctx.kept
        energy, along, damping, share = (
            torch.stack(part)
            for part in zip(*((s.energy, s.along, s.damping, s.share) for s in kept), strict=True)
        )
        unit = energy / joints
        along_slope = -unit / (energy + AT_REST)
        v_slope = -2 * along * (1 / joints + along_slope)
        drag = torch.addcmul(damping, along, unit)
        shared = (unit, along_slope, v_slope, drag, share - 1, share - share * share)

        d_first, d_second = torch.empty_like(first), torch.empty_like(second)
        d_out = d_motion.new_zeros(len(context), steps, batch, weight2.shape[1])
        d_geometry, d_metric, d_potential, d_damping = d_out.unflatten(0, (-1, seeds)).unbind()
        d_bend, d_weight = d_geometry.split(joints, dim=-1)
        d_metric, d_potential = d_metric[..., :joints], d_potential[..., :joints]
        d_damping = d_damping[..., :1]
        of_networks = (first, second, d_first, d_second, d_out)
        outputs = (d_bend, d_weight, d_metric, d_potential, d_damping)
        by_step = zip(
            kept,
            d_motion.unbind(2),
            zip(*(part.unbind() for part in shared), strict=True),
            zip(*(part.unbind(1) for part in of_networks), strict=True),
            zip(*(part.unbind(1) for part in outputs), strict=True),
            torch.expm1(-damping).unbind(),
            strict=True,
        )
        d_pulls, d_back1s, d_back2s = [], [], []
        d_q = d_v = d_motion.new_zeros(seeds, batch, joints)
        for step, d_next, scalars, networks, into, d_softplus in reversed(list(by_step)):
            unit, along_slope, v_slope, drag, rest, share_slope = scalars
            h1, h2, d_h1, d_h2, d_o = networks
            d_bend, d_weight, d_metric, d_potential, d_damping = into
            h1_p, h2_p, slope1_p, slope2_p = _of_potential(
                h1, h2, step.slope1, step.slope2, seeds=seeds
            )
            d_q = d_q + d_next
            d_v = torch.add(d_v, d_q, alpha=CONTROL_STEP)
            d_change = d_v * CONTROL_STEP
            with_force = (d_change * step.force).sum(dim=-1, keepdim=True)
            with_v = (d_change * step.v).sum(dim=-1, keepdim=True)

            d_pull = d_change * rest
            d_lever1 = plain_product(d_pull, psi0.mT)
            d_back1 = d_lever1 * slope1_p
            d_lever2 = plain_product(d_back1, psi1.mT)
            d_back2 = d_lever2 * slope2_p
            d_residual = plain_product(d_back2, psi2.mT).add_(k * d_pull)
            d_potential.copy_(d_residual)

            d_along = with_v * along_slope
            d_force = torch.addcmul(unit * d_change, d_along, step.v)
            torch.mul(d_force, step.share, out=d_bend)
            d_share = torch.addcmul(d_force * step.bend, d_change, step.pull)
            torch.mul(d_share, share_slope, out=d_weight)
            torch.neg(d_weight, out=d_metric)
            torch.mul(with_v, d_softplus, out=d_damping)

            into2 = plain_product(d_o, weight2)
            _of_potential(into2, seeds=seeds)[0].addcmul_(d_lever2 * step.back2, h2_p, value=-2)
            torch.mul(into2, step.slope2, out=d_h2)
            into1 = plain_product(d_h2, weight1)
            _of_potential(into1, seeds=seeds)[0].addcmul_(d_lever1 * step.back1, h1_p, value=-2)
            torch.mul(into1, step.slope1, out=d_h1)
            d_x = plain_product(d_h1, weight0).unflatten(0, (-1, seeds)).sum(dim=0)
            of_q, of_v = d_x.split(joints, dim=-1)

            d_energy = torch.addcmul(with_force * (2 / joints), with_v, v_slope)
            d_v = torch.addcmul(d_v, d_change, drag, value=-1).add_(of_v)
            d_v.addcmul_(d_along, step.force).addcmul_(d_energy, step.v)
            d_q = torch.addcmul(d_q, k, d_residual).add_(of_q)
            d_pulls.append(d_pull)
            d_back1s.append(d_back1)
            d_back2s.append(d_back2)

        qs, residuals, levers2, levers1 = (
            torch.cat(part, dim=1)
            for part in zip(*((s.q, s.residual, s.lever2, s.lever1) for s in kept), strict=True)
        )
        pulls, backs1, backs2 = (
            torch.cat(part[::-1], dim=1) for part in (d_pulls, d_back1s, d_back2s)
        )
        d_potential = outputs[3].flatten(1, 2)
        d_stiffness = (residuals * pulls + qs * d_potential).sum(dim=1)
        d_weight0, d_weight1, d_weight2 = (
            _product(d, x) for d, x in ((d_first, inputs), (d_second, first), (d_out, second))
        )
        d_psi0, d_psi1, d_psi2 = _of_potential(d_weight0, d_weight1, d_weight2, seeds=seeds)
        d_psi0[:, :, :joints] += plain_product(levers1.mT, pulls)
        d_psi1 += plain_product(levers2.mT, backs1)
        d_psi2[:, :joints] += plain_product(residuals.mT, backs2)
        of_context = d_first.sum(dim=1)
        d_bias0 = of_context.sum(dim=1)
        d_bias1, d_bias2 = (part.sum(dim=(1, 2)) for part in (d_second, d_out))
        d_context = plain_product(of_context.mT, context)
        d_layers = (d_context, d_bias0, d_weight0, d_bias0, d_weight1, d_bias1, d_weight2, d_bias2)
        d_arrays = [d for layer in d_layers for d in layer.unflatten(0, (-1, seeds)).unbind()]
        cut = [
            d[tuple(slice(width) for width in shape)]
            for d, shape in zip(d_arrays, ctx.shapes, strict=True)
        ]
        return None, None, None, None, d_stiffness, *cut


def _side_by_side(arrays: Sequence[Tensor]) -> Tensor:
    """Returns the arrays (S, ...) of N networks as one, (N S, ...), with zeros up to the widest."""
    shapes = [array.shape for array in arrays]
    if len(set(shapes)) == 1:
        return torch.stack(list(arrays)).flatten(0, 1)
    widest = [max(widths) for widths in zip(*shapes, strict=True)]
    filled = arrays[0].new_zeros(len(arrays), *widest)
    for place, array in zip(filled, arrays, strict=True):
        place[tuple(slice(width) for width in array.shape)] = array
    return filled.flatten(0, 1)


def _of_potential(*parts: Tensor, seeds: int) -> list[Tensor]:
    """Returns the potential's share (S, ...) of parts (N S, ...)."""
    begin = NETWORKS.index("potential") * seeds
    return [part[begin : begin + seeds] for part in parts]


def _product(left: Tensor, right: Tensor) -> Tensor:
    """Returns the sums over steps and samples of outer products, of (N S, W, B, ...)."""
    return plain_product(left.flatten(1, 2).mT, right.flatten(1, 2))
