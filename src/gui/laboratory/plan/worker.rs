//! Predictions and searches on other threads, or while the caller waits.

use std::ops::ControlFlow;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, Sender, TryRecvError, channel};
use std::sync::{Arc, Mutex};
use std::thread::Builder;

use egui::Context;

use crate::observability::laboratory::{MotionLimits, MotionPrediction, MotionPredictor, MotionProblem, MotionStart};
use crate::simulation::MotionSplines;

/// Number of trials of a search between two messages.
const TRIALS_PER_MESSAGE: usize = 8;

/// Motion whose σ is asked for.
#[derive(Clone, Debug)]
struct PredictionRequest {
    problem: Arc<MotionProblem>,
    motion: MotionSplines,
    /// Number of the request, and its time by the window's clock in seconds.
    asked: (u64, f64),
}

/// Prediction with the time of its request.
struct PredictedMotion {
    prediction: Option<MotionPrediction>,
    /// Number of the request, and its time by the window's clock in seconds.
    asked: (u64, f64),
}

/// Thread that predicts the last requested motion.
struct PredictionThread {
    requests: Sender<PredictionRequest>,
    answers: Receiver<PredictedMotion>,
}

/// σ of the motion that was requested last.
#[derive(Default)]
pub(super) struct MotionSigmas {
    asked: Option<PredictionRequest>,
    thread: Option<PredictionThread>,
    /// Of a caller that waits.
    predictor: MotionPredictor,
    last: Option<MotionPrediction>,
    /// Number of the last request that is answered, and time from it to the frame with the answer, in seconds.
    answered: Option<(u64, f64)>,
}

impl MotionSigmas {
    /// Requests σ of a motion unless it was the last request, and receives answers.
    pub(super) fn request(
        &mut self,
        problem: &Arc<MotionProblem>,
        motion: &MotionSplines,
        context: &Context,
        in_background: bool,
    ) {
        let known = self.asked.as_ref().is_some_and(|it| Arc::ptr_eq(&it.problem, problem) && it.motion == *motion);
        if !known {
            let number = self.asked.as_ref().map_or(0, |asked| asked.asked.0 + 1);
            let asked = (number, now_s(context));
            let request = PredictionRequest { problem: Arc::clone(problem), motion: motion.clone(), asked };
            self.asked = Some(request.clone());
            if !in_background || !self.send(request, context) {
                self.last = self.predictor.predict(problem, motion);
                self.answered = None;
            }
        }
        self.receive(context);
    }

    /// Passes a request to the thread; false without one.
    fn send(&mut self, request: PredictionRequest, context: &Context) -> bool {
        if self.thread.is_none() {
            self.thread = PredictionThread::start(context.clone());
        }
        self.thread.as_ref().is_some_and(|thread| thread.requests.send(request).is_ok())
    }

    fn receive(&mut self, context: &Context) {
        let Some(thread) = &self.thread else { return };
        while let Ok(PredictedMotion { prediction, asked }) = thread.answers.try_recv() {
            self.last = prediction;
            self.answered = Some((asked.0, now_s(context) - asked.1));
        }
    }

    /// The last prediction, which may belong to an earlier request.
    pub(super) fn last(&self) -> Option<&MotionPrediction> {
        self.last.as_ref()
    }

    /// True if the last prediction belongs to an earlier request.
    #[cfg(test)]
    pub(super) fn is_busy(&self) -> bool {
        self.thread.is_some()
            && self.asked.as_ref().is_some_and(|asked| self.answered.is_none_or(|(number, _)| number != asked.asked.0))
    }

    /// Time in seconds from the frame with a change of the motion to that with its σ, of the last prediction on the thread.
    pub(super) fn latency_s(&self) -> Option<f64> {
        self.answered.map(|(_, latency_s)| latency_s)
    }
}

/// Time of the frame by the window's clock, in seconds.
fn now_s(context: &Context) -> f64 {
    context.input(|input| input.time)
}

impl PredictionThread {
    /// Starts the thread; it ends when this value is dropped. `None` if the system has no thread left.
    fn start(context: Context) -> Option<Self> {
        let (requests, received) = channel::<PredictionRequest>();
        let (sender, answers) = channel();
        let work = move || {
            let mut predictor = MotionPredictor::default();
            while let Ok(mut request) = received.recv() {
                // Only the last of the waiting requests matters.
                while let Ok(newer) = received.try_recv() {
                    request = newer;
                }
                let prediction = predictor.predict(&request.problem, &request.motion);
                if sender.send(PredictedMotion { prediction, asked: request.asked }).is_err() {
                    break;
                }
                context.request_repaint();
            }
        };
        Builder::new().name("plan-prediction".to_owned()).spawn(work).ok()?;
        Some(Self { requests, answers })
    }
}

/// Long computation of a motion.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum PlanSearch {
    /// A motion from which to start.
    Start(MotionStart),
    /// A better motion, by this number of changes with coarse windows.
    Improve { trials: usize },
}

/// State of a search.
pub(super) enum SearchState {
    /// A better motion than those before.
    Running(MotionSplines),
    /// The result; `None` if a number is not finite.
    Done(Option<MotionSplines>),
}

/// Message of the thread.
enum SearchMessage {
    /// Ratio that is done; a better motion, if there is a new one.
    Progress(f64, Option<MotionSplines>),
    Done(Option<MotionSplines>),
}

/// A search on another thread; dropping it stops the thread.
pub(super) struct RunningSearch {
    pub(super) kind: PlanSearch,
    /// Motion before the search.
    pub(super) before: MotionSplines,
    pub(super) progress: f64,
    messages: Receiver<SearchMessage>,
    is_stopped: Arc<AtomicBool>,
}

impl Drop for RunningSearch {
    fn drop(&mut self) {
        self.stop();
    }
}

impl RunningSearch {
    /// Starts a search from a motion; a caller that waits gets it completed.
    pub(super) fn start(
        kind: PlanSearch,
        problem: &Arc<MotionProblem>,
        limits: &MotionLimits,
        motion: &MotionSplines,
        context: &Context,
        in_background: bool,
    ) -> Self {
        let (sender, messages) = channel();
        let is_stopped = Arc::new(AtomicBool::new(false));
        let search =
            Self { kind, before: motion.clone(), progress: 0.0, messages, is_stopped: Arc::clone(&is_stopped) };
        let (problem, limits, before, context) = (Arc::clone(problem), limits.clone(), motion.clone(), context.clone());
        let work = move || {
            let (watcher, waker) = (sender.clone(), context.clone());
            let shown = Mutex::new((0, before.clone()));
            let watch = move |progress: f64, best: &MotionSplines| {
                let Ok(mut shown) = shown.lock() else { return ControlFlow::Break(()) };
                shown.0 += 1;
                if shown.0 % TRIALS_PER_MESSAGE == 0 {
                    let better = (shown.1 != *best).then(|| best.clone());
                    shown.1 = better.clone().unwrap_or_else(|| shown.1.clone());
                    if watcher.send(SearchMessage::Progress(progress, better)).is_err() {
                        return ControlFlow::Break(());
                    }
                    waker.request_repaint();
                }
                if is_stopped.load(Ordering::Relaxed) { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
            };
            let found = match kind {
                PlanSearch::Start(start) => Some(problem.start(start, &limits, before.duration_s())),
                PlanSearch::Improve { trials } => problem.improve(&before, &limits, trials, &watch),
            };
            // The receiver is dropped if the panel was closed meanwhile.
            drop(sender.send(SearchMessage::Done(found)));
            context.request_repaint();
        };
        if in_background {
            // Without a thread the sender is dropped, which ends the search without a result.
            drop(Builder::new().name("plan-search".to_owned()).spawn(work));
        } else {
            work();
        }
        search
    }

    /// Asks the search to end with its best motion so far.
    pub(super) fn stop(&self) {
        self.is_stopped.store(true, Ordering::Relaxed);
    }

    /// State with the newest motion; `None` if nothing has changed.
    pub(super) fn poll(&mut self) -> Option<SearchState> {
        let mut newest = None;
        loop {
            match self.messages.try_recv() {
                Ok(SearchMessage::Progress(progress, better)) => {
                    self.progress = progress;
                    newest = better.or(newest);
                }
                Ok(SearchMessage::Done(found)) => return Some(SearchState::Done(found)),
                Err(TryRecvError::Disconnected) => return Some(SearchState::Done(None)),
                Err(TryRecvError::Empty) => return newest.map(SearchState::Running),
            }
        }
    }
}
